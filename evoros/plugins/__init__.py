"""Optional plug-ins, each in a folder with all its parts; the core imports none of them."""
