"""Laws of motion beside raw toppra and raw ruckig, in one run: ``python -m bench.time_laws``."""
