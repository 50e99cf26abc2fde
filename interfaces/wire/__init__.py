"""How values are written wherever they cross or are stored: types of fields with their ranges, and commands."""
