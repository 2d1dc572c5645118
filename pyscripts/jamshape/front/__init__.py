"""The front door: what `import jamshape as js` offers, in words of its own."""
