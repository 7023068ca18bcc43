"""Result files: HDF5 and CSV written safely, the text log, and reading back.

`recorder` turns output rows into named signals, `store` and `part_file` keep the file whole
whatever happens, `memory` holds them where there is no folder, `reading` gives them back by name.
"""
