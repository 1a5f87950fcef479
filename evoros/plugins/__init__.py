"""Optional plug-ins, one folder each; the core imports none of them."""
