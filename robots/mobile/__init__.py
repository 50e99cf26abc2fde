"""Any mobile robot on two driven wheels: chassis, senses, bodies with and without physics, rooms to drive in."""
