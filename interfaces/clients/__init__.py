"""Clients of an engine, here or elsewhere: Designer, Observer, Supervisor, Viewer and what they are made of."""
