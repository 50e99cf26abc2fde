"""The drivers that run twins, in the laboratory and live."""
