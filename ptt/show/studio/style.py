"""How the page is laid out: one screen, no view scrolls as a whole above 1024 x 700."""

CSS = """
body { background: #f5f6f7; color: #222; }
.nicegui-content { padding: 0; gap: 0; height: 100vh; height: calc(100vh - 48px); display: flex; flex-wrap: nowrap; }
.st-header { height: 48px; padding: 0 12px; align-items: center; gap: 8px; flex-wrap: nowrap; background: #20394c; }
.st-brand { font-weight: 600; font-size: 17px; margin-right: 8px; white-space: nowrap; }
.st-tabs .q-tab { min-height: 48px; padding: 0 12px; }
.st-status { width: 100%; min-height: 34px; padding: 2px 12px; align-items: center; gap: 12px; flex-wrap: nowrap;
  background: #e6ebef; justify-content: space-between; }
.st-told { overflow: hidden; text-overflow: ellipsis; white-space: nowrap; flex: 1 1 0; min-width: 0; }
.st-busy { align-items: center; gap: 8px; flex-wrap: nowrap; flex: 0 0 auto; }
.st-bar { width: 110px; }
.st-alert { width: 100%; padding: 4px 12px; background: #fff3cd; border-left: 6px solid #e69f00; align-items: center;
  gap: 8px; flex-wrap: nowrap; }
.st-trouble { flex: 1 1 0; min-width: 0; overflow-wrap: anywhere; }
.st-panels { width: 100%; flex: 1 1 0; min-height: 0; background: transparent; }
.st-panels > .q-panel { height: 100%; }
.st-panel { padding: 8px 10px; height: 100%; overflow: auto; }
.st-box { background: #fff; border: 1px solid #d8dde1; border-radius: 4px; padding: 8px 10px; min-width: 0;
  min-height: 0; width: 100%; }
.st-col { display: flex; flex-direction: column; gap: 8px; min-width: 0; min-height: 0; height: 100%; }
.st-two { display: grid; grid-template-columns: minmax(0, 1fr) minmax(0, 1fr); gap: 8px; height: 100%;
  min-height: 0; width: 100%; }
.st-wide-left { grid-template-columns: minmax(0, 13fr) minmax(0, 9fr); }
.st-scroll { overflow: auto; }
.st-scroll > .st-box { flex: 0 0 auto; }
.st-head { font-weight: 600; font-size: 15px; margin: 0; }
.st-note { color: #444; font-size: 13px; overflow-wrap: anywhere; }
.st-plot { width: 100%; flex: 1 1 0; min-height: 0; }
.st-tools { display: flex; gap: 8px; align-items: center; flex-wrap: wrap; width: 100%; }
.st-line { flex-wrap: nowrap; }
.st-line > .q-select { flex: 1 1 0; min-width: 84px; }
.st-mono { font-family: monospace; font-size: 12.5px; white-space: pre-wrap; overflow-wrap: anywhere; }
.st-grid { display: grid; gap: 2px 10px; align-items: center; width: 100%; font-size: 13.5px; }
.st-grid > .st-h { font-weight: 600; border-bottom: 1px solid #c5ccd2; align-self: stretch; }
.st-right { text-align: right; font-variant-numeric: tabular-nums; }
.st-verdict { font-size: 18px; font-weight: 600; }
.st-look { display: grid; grid-template-columns: minmax(0, 11fr) minmax(0, 9fr); gap: 8px; height: 100%;
  grid-template-rows: minmax(0, 5fr) minmax(150px, 2fr); min-height: 560px; width: 100%; }
.st-look > .st-table { grid-column: 1 / 3; }
.st-drop { width: 100%; box-shadow: none; border: 1.5px dashed #8fa3b3; }
.st-drop .q-uploader__list { min-height: 0; max-height: 72px; padding: 0; }
.st-drop .q-uploader__header { background: #f5f8fa; color: #222; }
.st-drop .q-uploader__header .q-btn, .st-drop .q-uploader__subtitle { display: none; }
.st-pre { white-space: pre; overflow-x: auto; width: 100%; }
table.st-plain { border-collapse: collapse; width: 100%; font-size: 13px; font-variant-numeric: tabular-nums; }
table.st-plain th { text-align: right; font-weight: 600; position: sticky; top: 0; background: #fff; }
table.st-plain td { text-align: right; padding: 1px 8px; border-top: 1px solid #eee; }
table.st-plain th:first-child, table.st-plain td:first-child { text-align: left; }
:focus-visible { outline: 3px solid #e69f00 !important; outline-offset: 1px; }
"""
