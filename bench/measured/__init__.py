"""Small measurements for pages, a file a figure: ``parts()`` gives its tables and sentences."""
