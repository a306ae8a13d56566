"""A robot that learns to find a home it cannot see: the model of Altahhan (2014), its world and its study."""
