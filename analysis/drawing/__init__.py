"""Drawing code for all figures: style, panels, text tables, top views of robots and worlds."""
