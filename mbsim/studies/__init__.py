"""Many runs of one model: study files, designs, workers, tables of results."""
