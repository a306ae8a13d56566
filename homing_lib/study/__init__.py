"""The study: questions put to the model, their runs, tables and verdicts. It knows the model, no figures."""
