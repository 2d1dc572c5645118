"""Public interface: the names that `import jamshape as js` offers."""
