"""CSV, Parquet and other tables as a raw log of one topic, named after the file; its fields are the numeric columns.

Nothing was received, so there are no receive times and no header stamps: the import's mapping names the time column.
"""

from __future__ import annotations
