"""Bags of rosbag2, written and read without middleware."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import IO, Any, NamedTuple, cast

import mcap.writer
from mcap.reader import NonSeekingReader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection, Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.typesys import Stores, get_typestore

from manta_sim_ros.dynamics import cut, shown_names
from manta_sim_ros.nodes.interface import TOPICS
from manta_sim_ros.nodes.settings import Settings

TYPES = get_typestore(Stores.ROS2_JAZZY)
"""Definitions of the messages; those of the simulator are the same in all later distributions."""

UNLIMITED = QosTime(9_223_372_036, 854_775_807)
"""The deadline, lifespan and lease that rosbag2 writes for none: 2^63 - 1 ns."""

SETTINGS = 'manta_sim_parameters'
"""The key of the parameters in the custom data of `metadata.yaml`: a JSON object of full names and values."""

MAGIC = b'\x89MCAP0\r\n'
"""The first and the last bytes of a file in the format MCAP."""

OF_A_ROBOT = ('odom', 'fin_command', 'rod_command')
"""The topics by which a robot is found in a bag."""


def check_new(path: Path) -> None:
    """Raise a ValueError if there is something at the path of an output."""
    if path.exists() or path.is_symlink():
        raise ValueError(f'{path} exists, but the output must be new')


class RecordingWarning(UserWarning):
    """A bag has no end, as if its recorder was killed or still runs: it is read up to its last whole chunk."""


class BagWriter:
    """A new bag in the format MCAP, in compressed chunks; what is on the disk stays readable if the process is killed.

    Leaving the context always completes the bag, after an exception too.

    Parameters
    ----------
    path
        The directory, which must not exist.
    settings
        The parameters with which the messages are made.

    Raises
    ------
    ValueError
        The directory exists.

    """

    def __init__(self, path: Path, settings: Settings) -> None:
        check_new(path)
        self._writer = Writer(path, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._writer.set_custom_data(
            SETTINGS, json.dumps({name: settings.value(name) for name in Settings.quantities()}))
        self._connections: dict[str, Connection] = {}

    def __enter__(self) -> BagWriter:
        self._writer.open()
        storage = cast(McapWriter, self._writer.storage)
        storage.path = storage.path.rename(storage.path.with_stem(f'{storage.path.stem}_0'))  # for ros2 bag reindex
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None,
    ) -> None:
        self._writer.close()

    def add_topic(self, name: str, depth: int, *, keeps_last: bool) -> None:
        """Add one of `TOPICS`, with the QoS of its publisher, which is reliable."""
        self._connections[name] = self._writer.add_connection(
            f'/{name.removeprefix("/")}', TOPICS[name].type, typestore=TYPES, offered_qos_profiles=[Qos(
                QosHistory.KEEP_LAST, depth, QosReliability.RELIABLE,
                QosDurability.TRANSIENT_LOCAL if keeps_last else QosDurability.VOLATILE,
                UNLIMITED, UNLIMITED, QosLiveliness.AUTOMATIC, UNLIMITED,
                avoid_ros_namespace_conventions=False)])

    def write(self, name: str, time: int, data: bytes) -> None:
        """Write a serialized message of a topic at a time [ns]."""
        self._writer.write(self._connections[name], time, data)
        cast(McapWriter, self._writer.storage).bio.flush()  # so that what is on the disk ends with a whole record


class Logged(NamedTuple):
    """A message of a bag."""

    name: str
    """Name of its topic without the namespace, as in `TOPICS`."""
    time: int
    """Time at which it was logged [ns]."""
    data: bytes
    """The serialized message."""


class BagReader:
    """The topics of one robot in a bag of rosbag2, whoever recorded it.

    If the recorder was killed or still runs, a bag of one file in the format MCAP is read up to its last whole chunk,
    with a RecordingWarning.

    Parameters
    ----------
    path
        The directory of the bag, or its MCAP file.
    namespace
        The namespace of the robot, such as `/manta`; by default that of the only robot in the bag.

    Raises
    ------
    ValueError
        It is no bag, it is damaged, it has no such robot, or several and no `namespace` was given. Begins with the
        path.

    """

    def __init__(self, path: str | Path, namespace: str | None = None) -> None:
        self._path, self._namespace = Path(path), namespace

    def __enter__(self) -> BagReader:
        with contextlib.ExitStack() as opened:
            try:
                path, cut_file = _with_end(self._path, opened)
                self._reader = opened.enter_context(AnyReader([path], default_typestore=TYPES))
            except Exception as error:  # rosbags raises errors of any kind where a file is damaged
                raise self._unreadable(error) from error
            if cut_file is not None:
                warnings.warn(
                    f'{cut_file}: has no end, as if its recorder was killed or still runs: it is read up to its last '
                    'whole chunk', RecordingWarning, stacklevel=2)
            self._connections = self._of_robot()
            self._opened = opened.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None,
    ) -> None:
        self._opened.close()

    @property
    def names(self) -> set[str]:
        """The names of the topics of the robot that have a message."""
        return {name for name, connection in self._connections.items() if connection.msgcount}

    @property
    def settings(self) -> Settings | None:
        """The parameters with which the messages were made, where the bag has them.

        Raises
        ------
        ValueError
            They are not those of this version.

        """
        custom = cast(Reader, self._reader.readers[0]).storage.metadata.custom or {}
        if SETTINGS not in custom:
            return None
        try:
            return Settings().replace(json.loads(custom[SETTINGS]).items())
        except (AttributeError, TypeError, ValueError) as error:
            raise ValueError(
                f'{self._path}: its parameters are not those of this version: {cut(str(error))}') from error

    def messages(self, names: Iterable[str]) -> Iterator[Logged]:
        """Yield the messages of some topics in the order of their times."""
        wanted = {self._connections[name].id: name for name in names if name in self._connections}
        if not wanted:
            return
        messages = self._reader.messages([self._connections[name] for name in wanted.values()])
        while True:
            try:
                connection, time, data = next(messages)
            except StopIteration:
                return
            except Exception as error:
                raise self._unreadable(error) from error
            yield Logged(wanted[connection.id], time, data)

    def decode(self, logged: Logged) -> Any:
        """Return a message as `rosbags` makes it."""
        try:
            return self._reader.deserialize(logged.data, TOPICS[logged.name].type)
        except Exception as error:
            raise self._unreadable(error) from error

    def _of_robot(self) -> dict[str, Connection]:
        """Return the connections of the topics by their names without namespace."""
        by_topic = {connection.topic: connection for connection in self._reader.connections}
        namespaces = {topic.removesuffix(f'/{name}') for topic in by_topic for name in OF_A_ROBOT
                      if topic.endswith(f'/{name}')}
        if self._namespace is None and len(namespaces) > 1:
            raise ValueError(
                f'{self._path}: has robots in the namespaces {shown_names(sorted(namespaces))}: choose one '
                '(--namespace)')
        namespace = self._namespace if self._namespace is not None else ''.join(namespaces)
        if namespace not in namespaces:
            raise ValueError(
                f'{self._path}: has none of the topics {", ".join(f"{namespace}/{name}" for name in OF_A_ROBOT)}')
        found = {}
        for name, about in TOPICS.items():
            connection = by_topic.get(f'{namespace}/{name.removeprefix("/")}') or by_topic.get(name)
            if connection is not None:
                if connection.msgtype != about.type:
                    raise ValueError(
                        f'{self._path}: {connection.topic} is of the type {shown_names([connection.msgtype])}, but '
                        f'must be {about.type}')
                found[name] = connection
        return found

    def _unreadable(self, error: Exception) -> ValueError:
        reason = cut(' '.join(str(error).split()).rstrip('.') or type(error).__name__)
        cure = ''
        if len(list(self._path.glob('*.mcap'))) > 1:
            cure = '; each of its MCAP files can be read alone'
        elif self._path.is_dir() and not (self._path / 'metadata.yaml').exists():
            cure = '; ros2 bag reindex can make its metadata.yaml'
        return ValueError(f'{self._path}: cannot be read as a bag: {reason}{cure}')


def _with_end(path: Path, opened: contextlib.ExitStack) -> tuple[Path, Path | None]:
    """Return the path to read, and the only MCAP file of a bag if that has no end.

    The path to read is the bag itself; its only file, if the bag has no metadata; or a temporary copy with an end and
    an index, if that file has no end. The copy is deleted when `opened` is closed.
    """
    files = list(path.glob('*.mcap')) if path.is_dir() else [path]
    if len(files) != 1 or files[0].suffix != '.mcap':
        return path, None
    (file,) = files
    with file.open('rb') as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise ValueError(f'{file.name} is no MCAP file')
        stream.seek(-len(MAGIC), os.SEEK_END)
        if stream.tell() > 0 and stream.read() == MAGIC:
            return path if (path / 'metadata.yaml').exists() else file, None
        stream.seek(0)
        copy = Path(opened.enter_context(tempfile.TemporaryDirectory(prefix='manta_sim_ros-')), file.name)
        _copy(stream, copy)
    return copy, file


def _copy(stream: IO[bytes], path: Path) -> None:
    """Copy the messages of a file in the format MCAP, as many as can be read.

    Raises
    ------
    ValueError
        There is none.

    """
    messages = NonSeekingReader(stream).iter_messages(log_time_order=False)
    channels: dict[int, int] = {}
    with path.open('wb') as copy:
        writer = mcap.writer.Writer(copy)
        writer.start('ros2')
        while True:
            try:
                schema, channel, message = next(messages)
            except Exception:  # of any kind where the file is cut
                break
            if channel.id not in channels:
                kind = 0 if schema is None else writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, kind, channel.metadata)
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence)
        writer.finish()  # type: ignore[no-untyped-call]
    if not channels:
        raise ValueError('it has no end and no whole chunk with a message')
