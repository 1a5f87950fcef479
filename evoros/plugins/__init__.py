"""Optional plug-ins, each in a folder with all its parts. The core imports none of them."""
