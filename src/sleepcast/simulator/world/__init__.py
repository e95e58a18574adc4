"""The solid things of a world, the files they are read from, and the grid that finds them."""
