"""Guards of other people's that the shield is compared with."""
