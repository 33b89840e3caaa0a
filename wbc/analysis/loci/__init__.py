"""Where coordinates lose rank: loci as equations, and pictures of them."""
