"""What a robot carries on board, whatever robot it is: a module a concept, and each is imported by its own name."""
