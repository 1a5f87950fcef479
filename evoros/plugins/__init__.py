"""Options beside the core, each a folder with all that it has. The core imports none of them."""
