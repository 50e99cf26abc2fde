"""VAL's monitor: commands, line editor, listings and files, without any input or output of its own."""
