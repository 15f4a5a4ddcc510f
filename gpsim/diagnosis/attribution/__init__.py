"""Attribution: how much of the mismatch is explained, by which effects, and which of them are claims."""

from gpsim.diagnosis.attribution.attribution import Attribution, attribute, explained_by
from gpsim.diagnosis.attribution.judges import Judge
from gpsim.diagnosis.attribution.less import fits_without
from gpsim.diagnosis.attribution.support import supported

__all__ = ["Attribution", "Judge", "attribute", "explained_by", "fits_without", "supported"]
