"""Take the places of the few modules of the shield that need a compiler, a solver of others or files in YAML.

A zip has nothing but numpy. Imports in them are those of the places they take, see `..package.STAND_INS`.
"""
