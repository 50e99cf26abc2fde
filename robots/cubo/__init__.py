"""The thin client CUBO: parameters, a body in PyBullet, shapes, and its robot model for RSP, `cubo.xmi`."""
