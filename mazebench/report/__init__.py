"""The report over evaluations: tables, figures, and a page to explore the episodes. The only place for plotting."""
