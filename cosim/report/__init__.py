"""Reports: one HTML file with the tables, pictures, diagrams and plain words of studies; it needs no network."""
