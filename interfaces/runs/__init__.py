"""What a run is, whoever made it and however it's kept: its facts, its record, its events and its figures."""
