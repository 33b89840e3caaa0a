"""One tick, in C or in numpy: rows, the QP, its answer, the certificate and the report."""
