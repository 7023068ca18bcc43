"""Result files: HDF5 and CSV written safely, the text log, and reading back.

`recorder` turns output rows into named signals, `store` and `part_file` keep the file whole
whatever happens, `reading` gives the signals back by name. Only `store` and `reading` know h5py.
"""
