"""What is learned and judged on: data sets, corpora, recordings."""
