"""Figures as files: drawing, picture and table say the same, with units, and go when the figure goes."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq

from pipeline import store
from pipeline.report import Report, index
from pipeline.report.figures import files


def test_every_figure_is_written_in_three_forms_with_the_unit_of_each_column(built: Report, tmp_path: Path) -> None:
    files.write(tmp_path.joinpath, built.pictures, {"mission": "synthetic"})
    drawn = {name: picture for name, picture in built.pictures.items() if picture is not None}
    written = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert written == {f"figures/{name}.{kind}" for name in drawn for kind in files.KINDS}
    assert written <= set(files.NAMES)
    for name, picture in drawn.items():
        path = tmp_path / "figures" / name
        assert path.with_suffix(".svg").read_text() == picture.svg
        assert "var(" not in picture.svg
        assert path.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
        schema = pq.read_schema(path.with_suffix(".parquet"))
        assert all(field.metadata[b"meaning"] for field in schema)
        assert any(field.metadata[b"unit"] for field in schema)
        assert store.read_metadata(path.with_suffix(".parquet"))["caption"] == picture.caption
        assert len(store.read_table(path.with_suffix(".parquet"))) > 0


def test_figures_of_the_index_are_written_beside_it(built: Report, tmp_path: Path) -> None:
    files.write(tmp_path.joinpath, index([store.plain(built.summary)]).pictures, {}, files.CAMPAIGN)
    written = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert written == set(files.CAMPAIGN_NAMES)
    gaps = store.read_table(tmp_path / "index.figures/gaps.parquet")
    parts = built.summary["parts"]
    assert gaps["error_cm_s"].tolist() == [100.0 * part["error_m_s"] for part in parts]
    table = store.read_table(tmp_path / "index.figures/coefficients.parquet")
    fitted = {item["name"]: item for item in built.summary["fit"]["parameters"]}
    drag = table[(table["coefficient"] == "parasite_drag") & (table["unit"] == "%")].iloc[0]
    assert (drag["value"], drag["std"]) == tuple(fitted["parasite_drag"][name] for name in ("percent", "percent_std"))


def test_a_figure_that_is_no_longer_drawn_is_removed(built: Report, tmp_path: Path) -> None:
    files.write(tmp_path.joinpath, built.pictures, {"mission": "synthetic"})
    files.write(tmp_path.joinpath, dict.fromkeys(built.pictures), {"mission": "synthetic"})
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []
