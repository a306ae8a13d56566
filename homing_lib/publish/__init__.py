"""What readers see: figures, film, numbers for LaTeX, executed notebooks. It knows the study and the model."""
