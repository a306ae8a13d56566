"""One file per question: the question, its studies, its predicate, its judge. `studies.load_questions` imports all."""
