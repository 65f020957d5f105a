# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
import pytest
import yaml
from damadics_bringup.fleet import simulated
from damadics_bringup.init import main
from damadics_fd.core.settings.settings import Settings
from damadics_fd.store.fleet_file import FleetError, read_fleet


@pytest.mark.parametrize('mode', ['monitor', 'scada'])
def test_what_is_written_can_be_run(tmp_path, mode, capsys):
    plant = tmp_path / 'plant'
    tags = ['LV-101', "Unit 3/FV '203", '7"-V']
    words = [word for tag in tags for word in ('--valve', tag)]
    assert main([str(plant), '--mode', mode, '--simulate', *words]) == 0
    valves = read_fleet(plant / 'fleet.yaml')
    assert [valve.name for valve in valves] == ['lv_101', 'unit_3_fv_203', 'v_7_v']
    assert len({valve.settings['reference'] for valve in valves}) == 3
    for valve, tag in zip(valves, tags, strict=True):
        values = yaml.safe_load(valve.parameters.read_text())['/**']['ros__parameters']
        assert values.pop('actuator') == tag
        settings = Settings.for_mode(values.pop('mode'), **values)
        assert settings.problems() == [] and settings.mode == mode
        assert valve.simulate
    assert 'commission' in (plant / 'NEXT.md').read_text()
    assert capsys.readouterr().out.splitlines()[-1].startswith('next: ros2 run')


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        ([], 'no valve is given'),
        (['--valve', '///'], 'is no tag'),
        (['--valve', 'LV-101', '--valve', 'lv 101'], 'the same name'),
        (['--valve', 'LV-101', '--rate', '0'], 'samples a second'),
    ],
)
def test_what_cannot_be_is_refused_with_a_remedy(tmp_path, words, said, capsys):
    assert main([str(tmp_path / 'plant'), *words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / 'plant').exists()


def answer(monkeypatch, *words):
    given = iter(words)
    monkeypatch.setattr('sys.stdin.isatty', lambda: True)
    monkeypatch.setattr('builtins.input', lambda _: next(given))


def test_who_is_asked_may_err_and_is_told_what_to_start(tmp_path, capsys, monkeypatch):
    answer(monkeypatch, '///', 'LV-101, LV-102', 'fast', '', 'many', '100', 'maybe', 'y')
    assert main([str(tmp_path / 'plant')]) == 0
    said = capsys.readouterr().out
    for problem in ('is no tag', 'no mode fast', 'many is no rate', 'answer y or n'):
        assert problem in said
    valves = read_fleet(tmp_path / 'plant' / 'fleet.yaml')
    assert [valve.name for valve in valves] == ['lv_101', 'lv_102']
    assert all(valve.simulate['rate'] == 100.0 for valve in valves)
    assert said.splitlines()[-1].endswith('fleet.yaml --dashboard --simulate')


def test_who_stops_answering_gets_no_files(tmp_path, capsys, monkeypatch):
    def leave(_):
        raise KeyboardInterrupt

    monkeypatch.setattr('sys.stdin.isatty', lambda: True)
    monkeypatch.setattr('builtins.input', leave)
    assert main([str(tmp_path / 'plant')]) == 130
    assert 'nothing was written' in capsys.readouterr().err
    assert not (tmp_path / 'plant').exists()


def test_files_of_before_are_not_overwritten(tmp_path, capsys):
    (tmp_path / 'fleet.yaml').write_text('mine')
    assert main([str(tmp_path), '--valve', 'LV-101']) == 2
    assert 'fleet.yaml already' in capsys.readouterr().err
    assert (tmp_path / 'fleet.yaml').read_text() == 'mine'


def test_a_folder_in_place_of_its_list_is_told_with_the_list(tmp_path):
    with pytest.raises(FleetError, match=r'is a folder: give its list, .*fleet\.yaml$'):
        read_fleet(tmp_path)


def test_in_a_mixed_fleet_only_the_simulated_valves_get_a_plant(tmp_path):
    file = tmp_path / 'fleet.yaml'
    file.write_text('valves: {real: {}, model: {simulate: {rate: 200.0}}}')
    assert [valve.name for valve in simulated(read_fleet(file))] == ['model']
