"""A link between real sockets: a user-space proxy for TCP and UDP that uses the same models."""

from interfaces.link.proxy.proxy import Address, Proxy, ProxySettings, parse_address

__all__ = ["Address", "Proxy", "ProxySettings", "parse_address"]
