"""What is measured of a packing or a run: order, contact statistics, the onset of jamming."""
