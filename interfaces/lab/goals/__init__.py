"""Goals in the laboratory: robots told where to go, in made-up apartments and a home, and who gets there."""
