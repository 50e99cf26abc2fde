"""The laboratory of the mobile robot: operators, runs, and tables of many runs."""
