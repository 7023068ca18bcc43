"""The manual: Markdown pages shipped with the package, and what finds, shows and makes them."""
