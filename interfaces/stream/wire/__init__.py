"""Messages as they cross: typed, with ranges; `interfaces.stream.codec` reads and writes them."""
