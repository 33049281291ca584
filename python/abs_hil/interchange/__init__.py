"""Files for other tools: MCAP (PlotJuggler, Foxglove) and Parquet, from recorded and from running experiments."""
