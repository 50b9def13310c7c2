"""The report page's style sheet: light, calm, one column on a phone."""

STYLE = """
:root{color-scheme:light}
*{box-sizing:border-box}
body{margin:0;background:#f7f7f4;color:#23303a;font:16px/1.55 system-ui,-apple-system,"Segoe UI",sans-serif}
main{max-width:1080px;margin:0 auto;padding:2rem 1rem 4rem}
h1{font-size:1.8rem;line-height:1.2;margin:0 0 .3rem}
h2{font-size:1.2rem;margin:2.6rem 0 .3rem}
h3{font-size:1rem;margin:.6rem 0}
p{margin:.3rem 0 .9rem;max-width:70ch}
.quiet,figcaption,.legend{color:#5b6670}
.facts{display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));gap:.7rem;margin:1.3rem 0;padding:0}
.facts div{background:#fff;border:1px solid #e3e3dc;border-radius:10px;padding:.6rem .9rem}
.facts dt{font-size:.85rem;color:#5b6670}
.facts dd{margin:0;font-size:1.15rem;font-weight:600;overflow-wrap:anywhere}
.warnings{background:#fff6e5;border:1px solid #efd9a7;border-radius:10px;margin:1.2rem 0;padding:.8rem 1rem}
.warnings ul{margin:.2rem 0 0;padding-left:1.2rem}
.row{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(46%,240px),360px));gap:1rem;align-items:start}
.wide{grid-template-columns:repeat(auto-fit,minmax(min(100%,440px),1fr))}
figure{margin:0}
figure img,svg{display:block;width:100%;height:auto;border-radius:8px}
.standing{max-width:560px}
figcaption{font-size:.9rem;margin-top:.3rem}
.scale{display:flex;gap:.7rem;align-items:center;max-width:30rem;margin:.7rem 0;font-size:.9rem}
.scale i{flex:1;height:12px;border-radius:6px}
.slider{position:relative;--x:50%;overflow:hidden;border-radius:8px;line-height:0}
.slider img{width:100%;height:auto}
.slider .after{position:absolute;inset:0;height:100%;clip-path:inset(0 0 0 var(--x))}
.slider::after{content:"";position:absolute;inset:0 auto 0 var(--x);width:2px;margin-left:-1px;background:#fff}
.slider:focus-within{outline:3px solid #1f7a8c}
.slider input{position:absolute;inset:0;z-index:1;width:100%;height:100%;margin:0;opacity:0;cursor:ew-resize;
touch-action:pan-y}
.slider span{position:absolute;bottom:10px;padding:.1rem .6rem;border-radius:6px;font-size:.85rem;line-height:1.5;
background:#23303acc;color:#fff}
.slider .left{left:10px}.slider .right{right:10px}
svg{font-size:13px;overflow:hidden}svg text{fill:#5b6670}
svg .grid{stroke:#23303a;stroke-opacity:.12;fill:none}svg .axis{stroke:#9aa3aa;fill:none}
.plan{max-width:520px;max-height:80vh;background:#eeeee8}
.legend{display:flex;flex-wrap:wrap;gap:.2rem 1rem;list-style:none;margin:.4rem 0;padding:0;font-size:.9rem}
.legend i{display:inline-block;width:.8em;height:.8em;border-radius:3px;margin-right:.4em}
.table{overflow-x:auto}
table{border-collapse:collapse;background:#fff;border:1px solid #e3e3dc;font-variant-numeric:tabular-nums}
th,td{padding:.35rem .9rem;border-bottom:1px solid #eeeee8;text-align:right}
th:first-child,td:first-child{text-align:left}
footer{margin-top:3rem;font-size:.9rem;color:#5b6670;overflow-wrap:anywhere}
"""
