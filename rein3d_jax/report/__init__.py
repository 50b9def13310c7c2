"""What a person looks at: the report, its charts and floor plan, the viewer page. Data in, text out."""
