import pytest
from hypothesis import given
from hypothesis import strategies as st

from survey.xmp import StatedAngles, gpano_number, gpano_text, stated_angles, xmp_properties

RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
GPANO = "http://ns.google.com/photos/1.0/panorama/"
DJI = "http://www.dji.com/drone-dji/1.0/"
CAMERA = "http://pix4d.com/camera/1.0/"


def packet(body: str, attributes: str = "") -> bytes:
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>'
        f'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="{RDF}" xmlns:G="{GPANO}" '
        f'xmlns:D="{DJI}" xmlns:C="{CAMERA}"><rdf:Description rdf:about="" {attributes}>'
        f'{body}</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def test_properties_are_read_from_attributes_and_elements() -> None:
    both = packet("<G:PosePitchDegrees> -3.5\n</G:PosePitchDegrees>", 'G:PoseHeadingDegrees="12"')
    properties = xmp_properties(both)
    assert gpano_number(properties, "PoseHeadingDegrees") == 12.0
    assert gpano_number(properties, "PosePitchDegrees") == -3.5
    assert gpano_text(properties, "ProjectionType") == ""
    assert gpano_number(properties, "FullPanoWidthPixels") is None


def test_parts_of_lists_and_structures_are_left_out() -> None:
    nested = "<G:Things><rdf:Seq><rdf:li>7</rdf:li></rdf:Seq></G:Things>"
    names = {name for _, name in xmp_properties(packet(nested))}
    assert names == {"about"}


def test_a_namespace_without_its_last_slash_is_the_same() -> None:
    bare = packet("<C:Yaw>5</C:Yaw>").replace(CAMERA.encode(), CAMERA[:-1].encode())
    assert stated_angles(xmp_properties(bare)).heading_deg == 5.0


def test_the_padding_of_a_packet_is_no_part_of_it() -> None:
    padded = packet("<G:ProjectionType>equirectangular</G:ProjectionType>") + b" \n" * 9 + b"\0"
    assert gpano_text(xmp_properties(padded), "ProjectionType") == "equirectangular"


@pytest.mark.parametrize(
    ("body", "angles"),
    [
        ("", (None, None, None)),
        ('G:PoseHeadingDegrees="10" G:PosePitchDegrees="2" G:PoseRollDegrees="-3"', (10, 2, -3)),
        ('D:GimbalYawDegree="-114.2" D:GimbalPitchDegree="-5.0"', (-114.2, -5.0, None)),
        ('C:Yaw="77" C:Pitch="357" C:Roll="1.5"', (77, -3, 1.5)),
        # At the horizon by Pix4D's count, at the zenith by Panoramax's: not known.
        ('C:Yaw="77" C:Pitch="90" C:Roll="0"', (77, None, 0)),
        ('C:Yaw="77" G:PoseHeadingDegrees="10" C:Pitch="4"', (10, 4, None)),
        ('G:PoseHeadingDegrees="NaN" D:GimbalYawDegree="inf" C:Yaw="east"', (None, None, None)),
        ('D:GimbalYawDegree="+12.50"', (12.5, None, None)),
    ],
)
def test_angles_come_from_the_first_source_that_has_them(
    body: str, angles: tuple[float | None, float | None, float | None]
) -> None:
    assert stated_angles(xmp_properties(packet("", body))) == StatedAngles(*angles)


def billion_laughs() -> bytes:
    entities = "".join(f'<!ENTITY l{level} "{f"&l{level - 1};" * 10}">' for level in range(1, 10))
    return f'<!DOCTYPE x [<!ENTITY l0 "ha">{entities}]><x>&l9;</x>'.encode()


@pytest.mark.parametrize(
    ("damaged", "reason"),
    [
        (billion_laughs(), "document type"),
        (billion_laughs().decode().encode("utf-16"), "document type"),
        (b'<!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>', "document type"),
        (b'<?xml version="1.0"?><!DOCTYPE x><x/>', "document type"),
        (b"", "not XML"),
        (b"<x", "not XML"),
        (packet("<G:PosePitchDegrees>")[:-30], "not XML"),
        (b"<a>" * 200_000, "nested more than"),
        (packet(" " * 1_000_000), "bytes, expected at most"),
        (b"\xff\xfe\x00", "not XML"),
        (b'<?xml version="1.0" encoding="cp437000"?><x/>', "not XML"),
    ],
)
def test_what_is_no_packet_is_refused_with_its_reason(damaged: bytes, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        xmp_properties(damaged)


@given(st.binary(max_size=300), st.integers(0, 700), st.integers(0, 40))
def test_any_bytes_are_read_or_refused(noise: bytes, at: int, gap: int) -> None:
    whole = packet("<G:PosePitchDegrees>1</G:PosePitchDegrees>", 'C:Yaw="3"')
    for damaged in (noise, whole[:at] + noise[:20] + whole[at + gap :]):
        try:
            angles = stated_angles(xmp_properties(damaged))
        except ValueError:
            continue
        assert isinstance(angles, StatedAngles)
