"""The page of a report: its data, its pieces of HTML, its script and style."""
