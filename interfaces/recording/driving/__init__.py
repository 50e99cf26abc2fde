"""What of a recording is a mobile robot's own: arcs, postures, rooms, and what is made of them."""
