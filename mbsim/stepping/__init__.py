"""Time-stepping methods that own contacts: MOREAU."""
