"""What a robot carries on board, whatever robot it is."""

from robots.onboard.servo import FeedForward, Servo, ServoGains

__all__ = ["FeedForward", "Servo", "ServoGains"]
