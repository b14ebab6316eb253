"""A box for files, dropped into it or chosen with its button."""

from collections.abc import Awaitable, Callable

from nicegui import events, ui

from ptt.errors import PttError
from ptt.show.studio.controller import Studio
from ptt.show.studio.guard import LIMIT


def upload_box(
    studio: Studio,
    label: str,
    key: str,
    take: Callable[[str, bytes], Awaitable[None]],
    *,
    choose: str,
    multiple: bool = False,
) -> ui.upload:
    """Build the box and its button, side by side in the current element.

    Args:
        studio: of this session; it shows why a file is refused.
        label: text of the box.
        key: ending of its CSS class 'st-drop-KEY'.
        take: called with name and content of each file.
        choose: label of the button for screen readers.
        multiple: whether several files may be chosen at once.

    Returns:
        The box.
    """

    async def uploaded(event: events.UploadEventArguments) -> None:
        data = await event.file.read()
        box.reset()
        try:
            await take(event.file.name, data)
        except PttError as error:
            studio.fail(str(error))

    box = ui.upload(
        label=label, on_upload=uploaded, max_file_size=LIMIT, auto_upload=True, multiple=multiple,
        on_rejected=lambda: studio.fail(f"not taken: larger than {LIMIT >> 20} MB"),
    )  # fmt: skip
    box.classes(f"st-drop st-drop-{key}").props("flat hide-upload-btn")
    button = ui.button("Choose").props("no-caps outline")
    button.props["aria-label"] = choose
    button.on("click", js_handler=f"() => getElement({box.id}).pickFiles()")
    return box
