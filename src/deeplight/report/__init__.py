"""What people look at: the HTML page, its charts, tables, and the record of a run."""
