"""Where coordinates lose rank: loci as equations, and pictures of them."""

from wbc import extras

extras.require("analysis", "exact rank analysis")
