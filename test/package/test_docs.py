"""The front door: the README is short, links lead somewhere, tables are those of the code, versions agree."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

import manta_sim_ros
from evidence import tables
from evidence.report import prose, read_table, table

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / 'docs').glob('*.md'))
TEXTS = [*ROOT.glob('*.md'), *PAGES]
LARGEST_README = 130


def links(path):
    """Return what a page links to in the repository, without links in blocks of code."""
    text = re.sub(r'^```.*?^```', '', path.read_text(encoding='utf-8'), flags=re.MULTILINE | re.DOTALL)
    return [target for target in re.findall(r'\]\(([^)\s]+)\)', text) if not re.match(r'https?:|mailto:', target)]


def names(path):
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize('path', PAGES, ids=names)
def test_the_tables_of_a_page_are_those_of_the_code(path):
    page = path.read_text(encoding='utf-8')
    assert tables.with_tables(page) == page, 'run make tables'
    assert page.count('<!-- table: ') == page.count('<!-- end -->') == len(tables.MARKED.findall(page))


def test_every_table_of_the_code_stands_on_one_page():
    marked = [name for path in PAGES for _, name, _ in tables.MARKED.findall(path.read_text(encoding='utf-8'))]
    assert sorted(marked) == sorted(tables.TABLES)


def test_a_table_that_is_not_that_of_the_code_is_noticed_and_mended():
    page = f'# Page\n\n<!-- table: services -->\n\n{table(("service",), [("~/stop",)])}\n\n<!-- end -->\n\nEnd.\n'
    mended = tables.with_tables(page)
    assert '~/stop' not in mended and '`~/reset`' in mended and mended.endswith('<!-- end -->\n\nEnd.\n')
    assert tables.with_tables(mended) == mended
    with pytest.raises(KeyError, match='no such table'):
        tables.with_tables('<!-- table: no such table -->\n<!-- end -->')


def test_every_equation_of_the_paper_has_a_function():
    _, *rows = read_table(tables.equations())
    assert [row[0] for row in rows] == [f'({number})' for number in range(1, tables.LAST_EQUATION + 1)]


@pytest.mark.parametrize(('text', 'numbers'), [
    ('the wrench, (31)', {31}), ('(6) to (10)', {6, 7, 8, 9, 10}),
    ('(2)-(4), (12)', {2, 3, 4, 12}), ('of shape (2, n), (39), 12', set())])
def test_the_numbers_of_equations_are_read_from_a_docstring(text, numbers):
    assert tables.equation_numbers(text) == numbers


def test_a_table_is_read_as_it_was_written():
    head, rows = ['a', '|b|'], [['1', 'x | y'], ['', '-']]
    assert read_table(f'before\n\n{table(head, rows)}\n\nafter | not\n') == [head, *rows]
    assert read_table('no table') == []


def test_prose_is_filled_and_a_table_in_it_stays():
    words, cells = 'word ' * 60, table(['a'], [['1']])
    filled = prose(f'{words}\n\n{cells}')
    assert all(len(line) <= 120 for line in filled.splitlines()) and filled.endswith(f'\n\n{cells}')
    assert filled.split() == [*words.split(), *cells.split()]


def test_the_readme_is_short_and_leads_to_every_page():
    readme = (ROOT / 'README.md').read_text(encoding='utf-8')
    assert len(readme.splitlines()) <= LARGEST_README
    linked = set(links(ROOT / 'README.md'))
    reached = linked | {f'docs/{target.partition("#")[0]}' for page in linked if page.endswith('.md')
                        for target in links(ROOT / page)}
    assert {names(page) for page in PAGES} - {'docs/index.md'} <= reached
    assert '.gif)' in readme


@pytest.mark.parametrize('path', TEXTS, ids=names)
def test_every_link_in_the_repository_leads_somewhere(path):
    for target in links(path):
        file, _, anchor = target.partition('#')
        there = (path.parent / file).resolve() if file else path
        assert there.exists() and there.is_relative_to(ROOT), target
        if anchor and there.name != 'kernels.md':  # made from the docstrings; `make docs` checks these
            headings = re.findall(r'^#+ (.*)', there.read_text(encoding='utf-8'), flags=re.MULTILINE)
            assert anchor in {re.sub(r'[^\w\- ]', '', heading).strip().lower().replace(' ', '-')
                              for heading in headings}, target


def test_the_site_has_every_page():
    site = yaml.safe_load((ROOT / 'mkdocs.yml').read_text(encoding='utf-8'))

    def pages(part):
        if isinstance(part, str):
            return [part]
        return [page for each in (part.values() if isinstance(part, dict) else part) for page in pages(each)]

    assert sorted(pages(site['nav'])) == [page.name for page in PAGES]
    assert site['strict'] is True


def test_the_version_is_the_same_everywhere():
    version = ElementTree.parse(ROOT / 'package.xml').findtext('version')
    assert re.fullmatch(r'\d+\.\d+\.\d+', version)
    assert manta_sim_ros.__version__ == version
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text(encoding='utf-8'))
    assert citation['version'] == version
    changelog = (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8')
    sections = re.findall(r'^(\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)\n-+$', changelog, flags=re.MULTILINE)
    assert sections[0] == (version, citation['date-released'])
    assert sections == sorted(sections, reverse=True)


def test_every_dependency_of_setup_is_declared_in_package_xml_and_the_other_way_round():
    package = ElementTree.parse(ROOT / 'package.xml')
    declared = {element.text for kind in ('exec_depend', 'depend') for element in package.iter(kind)}
    of_python = {'numba': 'python3-numba', 'numpy': 'python3-numpy', 'PyYAML': 'python3-yaml', 'scipy': 'python3-scipy'}
    setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
    required = set(re.findall(r"'([\w-]+)'", re.search(r'install_requires=\[(.*?)\]', setup)[1]))
    assert required == set(of_python)
    assert {of_python[name] for name in required} <= declared
    imported = {'rclpy', 'ament_index_python'} | {
        name for path in (ROOT / 'manta_sim_ros' / 'nodes').glob('*.py')
        for name in re.findall(
            r'^\s*from (\w+_(?:msgs|srvs|interfaces))\b', path.read_text(encoding='utf-8'), flags=re.MULTILINE)}
    assert len(imported) > 5 and imported <= declared
