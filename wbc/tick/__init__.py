"""One tick: rows, the QP, its answer, the certificate and the report."""
