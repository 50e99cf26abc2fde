"""Everything that joins a person or a machine to a robot."""
