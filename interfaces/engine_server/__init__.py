"""What stands beside an engine and serves its clients: journal, broadcaster, servlet, site."""
