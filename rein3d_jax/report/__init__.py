"""Pages for a person: the report, its charts and floor map, the viewer page. Data in, text out."""
