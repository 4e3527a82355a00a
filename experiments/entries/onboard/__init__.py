"""What goes into a shielded zip beside the shield's own modules: stand-ins for what needs a compiler, and the crew.

Modules here are packed under a private name, in which ``steerclear`` is that of the package they lie in. `jit`,
`shared`, `program` and `registry` take the places of `steerclear.shield`'s own: the compiled functions beside them run
as plain Python, on lists instead of arrays (see `wrapping.translate`).
"""
