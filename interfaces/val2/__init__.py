"""VAL-II: a language for the console and for programs."""
