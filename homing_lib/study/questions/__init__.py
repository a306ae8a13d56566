"""One file per question, in this order: the question, its studies, its predicate, its judge. `findings` finds them."""
