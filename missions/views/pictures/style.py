"""How drawn trees look: colours that the colour-blind tell apart (after Okabe and Ito), each with a border of its own.

Plain classes without variables: not every program that draws SVG knows more of CSS. Those that know of day and night
draw it dark at night; others draw it as by day.
"""

STYLE = """
text { font-family: "DejaVu Sans", Verdana, sans-serif; font-size: 11px; fill: #1d2530 }
.page { fill: #fdfdfe } .title { font-size: 22px; font-weight: bold } .summary { font-size: 13px; fill: #525c6a }
.moment { font-size: 13px; font-weight: bold; fill: #0067a8 }
.panel { fill: #f1f3f8; stroke: #d3d9e4 } .within { fill: #5d6776 }
.shadow { fill: #e3e7ed } .card { fill: #ffffff; stroke: #aeb7c3; stroke-width: 1.2 } .outline { fill: none }
.composite { fill: #434d5c } .mission { fill: #5f4b91 } .condition { fill: #0f736d } .action { fill: #2a5d8f }
.band.idle { fill: #767d88 } .band.running { fill: #0067a8 } .band.suspended { fill: #7a5200 }
.band.skipped { fill: #56616d } .band.success { fill: #00735a } .band.failure { fill: #b3400a }
.card.idle { stroke: #858c97; stroke-dasharray: 4 3 }
.card.running { fill: #eaf4fc; stroke: #0067a8; stroke-width: 3 }
.card.suspended { fill: #fdf3dc; stroke: #7a5200; stroke-width: 3; stroke-dasharray: 2 3 }
.card.success { fill: #ecf7f3; stroke: #00735a }
.card.skipped { fill: #f4f5f7; stroke: #56616d; stroke-dasharray: 1 3 }
.card.failure { fill: #fdf0e9; stroke: #b3400a; stroke-width: 1.5 }
.inner { fill: none; stroke: #b3400a; stroke-width: 1.2 }
.link { fill: none; stroke: #aeb7c3; stroke-width: 1.6 }
.link.idle { stroke: #a3aab4; stroke-dasharray: 4 3 } .link.running { stroke: #0067a8; stroke-width: 3 }
.link.suspended { stroke: #7a5200; stroke-width: 3; stroke-dasharray: 2 3 }
.link.skipped, .pill.skipped { stroke: #56616d; stroke-dasharray: 1 3 }
.link.success { stroke: #00735a } .link.failure { stroke: #b3400a; stroke-dasharray: 9 3 }
.symbol { fill: #ffffff; font-size: 14px; text-anchor: middle } .sample { text-anchor: middle }
.kind { font-size: 13px; font-weight: bold } .name { font-size: 13px }
.sign { font-size: 13px } .line { font-size: 10px; fill: #66707e }
.argument { fill: #434d5c } .folded { fill: #5f4b91 } .reason { fill: #1d2530 } .case { fill: #434d5c }
.sign.suspended { fill: #7a5200 }
.sign.running { fill: #0067a8 } .sign.success { fill: #00735a } .sign.failure { fill: #b3400a }
.pill { fill: #fdf3dc; stroke: #d9bd7a } .badge { fill: #573f00 }
.pill.running { stroke: #0067a8; stroke-width: 2 } .pill.success { stroke: #00735a }
.pill.suspended { stroke: #7a5200; stroke-width: 2; stroke-dasharray: 2 3 }
.pill.failure { stroke: #b3400a; stroke-width: 2 }
.same { opacity: 0.72 } .change { fill: #86305f }
.mark { stroke: #ffffff; stroke-width: 1.5 } .marked { fill: #ffffff; font-size: 12px; font-weight: bold }
.mark.changed { fill: #97376c } .mark.added { fill: #00735a } .mark.removed { fill: #b3400a }
.card.changed { fill: #fcf1f7; stroke: #97376c; stroke-width: 2 }
.card.added { fill: #ecf7f3; stroke: #00735a; stroke-width: 2.5 }
.card.removed { fill: #fdf0e9; stroke: #b3400a; stroke-width: 2; stroke-dasharray: 7 4 }
.rule { stroke: #d3d9e4; stroke-width: 1.5 }
@media (prefers-color-scheme: dark) {
text { fill: #e5e9ee } .page { fill: #12161b } .summary { fill: #a3aeba } .moment { fill: #7cc0f5 }
.panel { fill: #181d23; stroke: #343d48 } .within { fill: #a3aeba } .shadow { fill: #0a0d10 }
.card { fill: #1f262e; stroke: #56616d } .card.idle { stroke: #8a95a1 }
.card.running { fill: #152a3c; stroke: #7cc0f5 } .card.success { fill: #14302a; stroke: #67d0a8 }
.card.suspended { fill: #372c12; stroke: #f0c667 } .link.suspended { stroke: #f0c667 }
.sign.suspended { fill: #f0c667 } .pill.suspended { stroke: #f0c667 }
.card.skipped { fill: #1f262e; stroke: #a3aeba } .link.skipped, .pill.skipped { stroke: #a3aeba }
.card.failure { fill: #3a2119; stroke: #ff9f73 } .inner { stroke: #ff9f73 }
.link { stroke: #56616d } .link.idle { stroke: #6b7682 } .link.running { stroke: #7cc0f5 }
.link.success { stroke: #67d0a8 } .link.failure { stroke: #ff9f73 }
.line, .argument, .case { fill: #a3aeba } .folded { fill: #bdb0ea } .reason { fill: #e5e9ee }
.sign.running { fill: #7cc0f5 } .sign.success { fill: #67d0a8 } .sign.failure { fill: #ff9f73 }
.pill { fill: #3a3113; stroke: #8a6d1f } .badge { fill: #f2dfa8 } .pill.running { stroke: #7cc0f5 }
.pill.success { stroke: #67d0a8 } .pill.failure { stroke: #ff9f73 }
.change { fill: #eeb0d2 } .mark { stroke: #12161b } .card.changed { fill: #35202d; stroke: #d987b5 }
.card.added { fill: #14302a; stroke: #67d0a8 } .card.removed { fill: #3a2119; stroke: #ff9f73 }
.symbol, .marked { fill: #ffffff } .rule { stroke: #343d48 }
}
"""
