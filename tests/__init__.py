"""A folder for each package, with the package's own rooms; what tests share is in `helpers`."""
