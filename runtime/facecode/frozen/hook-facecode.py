"""What a frozen program needs beside the modules: the packaged bundles, recording and pages."""

from PyInstaller.utils.hooks import collect_data_files

datas = collect_data_files("facecode")
