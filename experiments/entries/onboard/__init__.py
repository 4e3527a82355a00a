"""What goes into a shielded zip beside the shield's own modules: the team and what it sees, and stand-ins.

Modules here are packed under a private name, in which ``steerclear`` is that of the package they lie in.
"""
