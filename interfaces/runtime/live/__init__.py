"""The live driver: wall time, sockets, and a body in a process of its own."""
